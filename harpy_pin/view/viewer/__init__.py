"""Meshcat in a loop of one's own: a page that shows the newest state, drawn in a process of its
own.
"""
