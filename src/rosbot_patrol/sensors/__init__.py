"""Motion sensors: which there are, what each said last, which is silent or faulty."""
