"""How far a disturbed teammate can move attention: the bounds of eqs. 6-10, and measurements."""
