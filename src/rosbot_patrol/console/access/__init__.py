"""Who may use the console: people, passwords, sessions, and the record of their orders."""
