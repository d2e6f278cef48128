"""What is measured: one module per section of the result, with the tables made of it."""
