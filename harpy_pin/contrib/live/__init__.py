"""Drive the robot in the browser: a session that knows no browser, and a page that shows it."""
