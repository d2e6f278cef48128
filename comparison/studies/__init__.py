"""The studies, each a question and a file."""
