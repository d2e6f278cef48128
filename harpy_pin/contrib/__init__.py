"""Extensions that the core never imports: flight, environments for learning, batches of robots,
watched thrusters, lags of second order, batteries.

Each is imported by its own name, such as ``from harpy_pin.contrib.flight import Jump``.
"""
