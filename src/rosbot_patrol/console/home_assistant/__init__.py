"""The guard in a smart home: MQTT with Home Assistant's discovery."""
