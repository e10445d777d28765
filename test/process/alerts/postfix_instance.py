"""A Postfix of the test's own: configuration, queue and mailboxes in a folder, nothing of the host's is touched."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

MAIN = """
compatibility_level = 3.6
queue_directory = {home}/queue
data_directory = {home}/data
maillog_file = {home}/log/mail.log
maillog_file_prefixes = {home}/log
command_directory = /usr/sbin
daemon_directory = /usr/lib/postfix/sbin
mail_owner = postfix
setgid_group = postdrop
myhostname = house.test
mydestination = house.test, localhost
mynetworks = 127.0.0.0/8
inet_interfaces = loopback-only
inet_protocols = ipv4
alias_maps =
alias_database =
mailbox_command =
mail_spool_directory = {home}/mail/
default_transport = error:this test sends nothing away
"""
MASTER = """
127.0.0.1:{port} inet n - n - - smtpd
pickup unix n - n 1 1 pickup
cleanup unix n - n - 0 cleanup
qmgr unix n - n 1 1 qmgr
rewrite unix - - n - - trivial-rewrite
bounce unix - - n - 0 bounce
defer unix - - n - 0 bounce
trace unix - - n - 0 bounce
flush unix n - n 1000? 0 flush
proxymap unix - - n - - proxymap
error unix - - n - - error
retry unix - - n - - error
local unix - n n - - local
anvil unix - - n - 1 anvil
postlog unix-dgram n - n - 1 postlogd
"""


def why_not():
    """Why no Postfix can be started here, "" where one can."""
    if shutil.which("postfix", path="/usr/sbin") is None:
        return "Debian's postfix is not installed"
    return "" if os.geteuid() == 0 else "only root can start Postfix"


class Postfix:
    """Runs from its making to `stop`; `sendmail` is a program that hands mails to it."""

    def __init__(self, port):
        self.port = port
        self.home = Path(tempfile.mkdtemp(prefix="rosbot_postfix_"))
        self.home.chmod(0o755)  # Postfix's own users look in
        for name in ("etc", "queue", "data", "log", "mail"):
            (self.home / name).mkdir()
        shutil.chown(self.home / "data", "postfix")
        (self.home / "mail").chmod(0o1777)
        (self.home / "etc" / "main.cf").write_text(MAIN.format(home=self.home))
        (self.home / "etc" / "master.cf").write_text(MASTER.format(port=port))
        self.sendmail = self.home / "sendmail"
        self.sendmail.write_text(f'#!/bin/sh\nexec /usr/sbin/sendmail -C {self.home}/etc "$@"\n')
        self.sendmail.chmod(0o755)
        self._command("start")

    def mailbox(self, user):
        """The user's Maildir."""
        return self.home / "mail" / user

    def log(self):
        path = self.home / "log" / "mail.log"
        return path.read_text() if path.exists() else ""

    def stop(self):
        self._command("stop")
        shutil.rmtree(self.home, ignore_errors=True)

    def _command(self, what):
        done = subprocess.run(
            ["/usr/sbin/postfix", "-c", str(self.home / "etc"), what], capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise RuntimeError(f"postfix {what}: {done.stdout}{done.stderr}{self.log()}")
