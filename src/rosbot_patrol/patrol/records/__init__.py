"""Records exchanged between the parts of a patrol: inputs, requests, missions, findings, commands."""
