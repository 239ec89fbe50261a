"""What learnt attention is worth: its teams beside those of other critics, in teams of any size."""
