"""How far a disturbed teammate can move attention: the bounds of eqs. 5-9, and measurements."""
