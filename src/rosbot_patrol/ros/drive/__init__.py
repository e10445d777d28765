"""The nodes that pass commands to the wheels: twist_mux and teleop_twist_keyboard."""
