"""The nodes twist_mux and teleop_twist_keyboard."""
