"""Does attention cause even sharing? Attention, rescue credit and logit penalty, crossed."""
