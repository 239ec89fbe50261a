"""A learnt policy for instances of task allocation: it says which task comes next in an order."""
