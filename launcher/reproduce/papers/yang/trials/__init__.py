"""The closed forms of Yang et al. (2009), their field, its targets and reports, and the setups that are tried."""
