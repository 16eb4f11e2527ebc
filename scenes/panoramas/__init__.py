"""What is far away, as pictures by direction."""
