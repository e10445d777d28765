"""Incidents and the mails about them, kept on disk until a transport took them."""
