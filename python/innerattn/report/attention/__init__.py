"""What learnt attention is worth, as a page with a figure."""
