"""Ways to the owner: mail, Maildir, sendmail, SMTP, webhook."""
