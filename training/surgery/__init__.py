"""Changes to a network that has been trained: wider, narrower, averaged, retuned; and what it errs on."""
