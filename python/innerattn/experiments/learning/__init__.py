"""What methods learn within a budget: scores over seeds, and courses of training."""
