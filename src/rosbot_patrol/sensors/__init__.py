"""Motion sensors: who they are, what they last said, and when one has gone silent."""
