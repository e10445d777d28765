"""The web server's part: who is let in, sign-in, pictures, and words in two languages."""
