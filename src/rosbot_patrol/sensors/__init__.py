"""Motion sensors: their list, their last messages, and which of them are silent or faulty."""
