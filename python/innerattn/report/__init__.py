"""Reports: draws what evaluation found; it measures nothing and trains nothing."""
