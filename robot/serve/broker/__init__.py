"""MQTT and Home Assistant: the same capabilities over a broker."""
