"""The console's node: topics into its pages, and its orders out."""
