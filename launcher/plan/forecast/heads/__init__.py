"""What is predicted of nodes of which any may lead."""
