"""What joins the sensor network to others: the gateway, forwarding nodes, and system control."""
