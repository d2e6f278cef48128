"""From the result to its readers: the answer, tables, figures, the page, JSON and CSV, and what
changed.
"""
