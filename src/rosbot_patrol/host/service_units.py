"""Files of the system that make the guard a service: unit, bound of its journal, bound of its logs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

NAME = "rosbot-patrol"
UNIT = Path(f"/etc/systemd/system/{NAME}.service")
JOURNAL = Path(f"/etc/systemd/journald@{NAME}.conf")
SETTINGS = Path("/etc/rosbot_patrol/service.conf")
USER = "rosbot-patrol"
HOME = Path(f"/var/lib/{NAME}")
LOGS = Path(f"/var/log/{NAME}")
GROUPS = ("dialout", "video", "plugdev")  # serial devices, cameras, USB
ROLES = {"alone": "rosbot_patrol.launch", "robot": "rosbot_patrol.launch", "pc": "rosbot_patrol_pc.launch"}

_JOURNAL_TEXT = """\
# Made by scripts/install-service: the guard's own journal stays below this.
[Journal]
SystemMaxUse=16M
RuntimeMaxUse=16M
MaxRetentionSec=3month
"""
# python's MemoryDenyWriteExecute would stop numba, which compiles; devices are those of GROUPS
_SANDBOX = """\
NoNewPrivileges=yes
CapabilityBoundingSet=
AmbientCapabilities=
ProtectSystem=strict
ProtectHome=read-only
PrivateTmp=yes
PrivateMounts=yes
ProtectProc=invisible
ProtectKernelTunables=yes
ProtectKernelModules=yes
ProtectKernelLogs=yes
ProtectControlGroups=yes
ProtectClock=yes
ProtectHostname=yes
LockPersonality=yes
RestrictSUIDSGID=yes
RestrictNamespaces=yes
RestrictAddressFamilies=AF_INET AF_INET6 AF_UNIX AF_NETLINK
RemoveIPC=yes
SystemCallArchitectures=native
SystemCallFilter=@system-service
SystemCallErrorNumber=EPERM
DevicePolicy=closed
DeviceAllow=char-ttyUSB rw
DeviceAllow=char-ttyACM rw
DeviceAllow=char-ttyS rw
DeviceAllow=char-video4linux rw
DeviceAllow=char-usb_device rw
UMask=0077
"""


@dataclass(frozen=True, kw_only=True)
class Service:
    """The service of one machine.

    Attributes:
        root: the checkout, which the service's user must be able to read.
        role: alone, robot or pc.
        groups: groups of the system that give access to devices.
    """

    root: Path
    role: str
    groups: tuple[str, ...] = GROUPS

    def unit(self) -> str:
        """The unit's file."""
        groups = f"SupplementaryGroups={' '.join(self.groups)}\n" if self.groups else ""
        return f"""\
# Made by scripts/install-service; taken away by `scripts/install-service --remove`.
[Unit]
Description=rosbot_patrol, the guard of the house ({self.role})
Documentation=file://{self.root}/docs/service.md
Wants=network-online.target
After=network-online.target time-sync.target rosbot-patrol-firewall.service wg-quick@patrol0.service
StartLimitIntervalSec=0

[Service]
Type=notify
NotifyAccess=all
User={USER}
{groups}ExecStart={self.root}/scripts/serve
Restart=always
RestartSec=1
TimeoutStartSec=300
TimeoutStopSec=20
KillMode=mixed
WatchdogSec=20
WatchdogSignal=SIGKILL
StateDirectory={NAME}
StateDirectoryMode=0700
LogsDirectory={NAME}
LogsDirectoryMode=0750
RuntimeDirectory={NAME}
RuntimeDirectoryMode=0700
WorkingDirectory={HOME}
Environment=HOME={HOME} ROS_HOME={HOME} ROS_LOG_DIR={LOGS} ROSOUT_DISABLE_FILE_LOGGING=1
Environment=ROS_PYTHON_LOG_CONFIG_FILE={self.root}/config/service_logging.conf
Environment=PYTHONUNBUFFERED=1 ROSCONSOLE_STDOUT_LINE_BUFFERED=1
LogNamespace={NAME}
LimitRTPRIO=1
LimitNICE=-15
{_SANDBOX}
[Install]
WantedBy=multi-user.target
"""

    def settings(self, arguments: tuple[str, ...]) -> str:
        """The file of what to launch, for root to change."""
        lines = [
            "# What the service starts: the role of this machine, and arguments of its launch file, one a line.",
            f"# docs/launch.md lists those of {ROLES[self.role]}. After a change: systemctl restart {NAME}",
            f"role: {self.role}",
            "arguments:",
            *(f"  - {argument}" for argument in arguments),
        ]
        return "\n".join(lines) + "\n"


def journal() -> str:
    """The bound of the guard's journal."""
    return _JOURNAL_TEXT
