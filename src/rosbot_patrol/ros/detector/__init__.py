"""The nodes darknet_ros and republish, and the download of weights."""
