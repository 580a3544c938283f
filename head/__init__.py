"""Masters, which track inside the network, and the base to which they tell what they know."""
