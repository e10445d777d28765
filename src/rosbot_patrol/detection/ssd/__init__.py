"""Single-shot detectors (SSD) from TensorFlow's object-detection API, run without TensorFlow."""
