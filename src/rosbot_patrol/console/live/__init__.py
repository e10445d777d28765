"""What the pages show now, and the orders that they give."""
