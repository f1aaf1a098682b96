"""What an experiment would see and cost, before anybody measures."""
