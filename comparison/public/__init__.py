"""Problems, models and motions that other people published, read from clones that the user made."""
