"""Houses of a campaign: our own, drawn ones, and strange worlds."""
