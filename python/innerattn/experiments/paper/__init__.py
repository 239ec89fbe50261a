"""The paper's Table II, Fig. 4 and Fig. 5 from finished runs, and its claims beside them."""
