"""Tasks of a whole-body problem: all kinds, and those that users have added to a problem."""
