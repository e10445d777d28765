"""What the parts of a patrol hand each other: inputs, requests, missions, findings, commands."""
