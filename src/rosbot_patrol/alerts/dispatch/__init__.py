"""The way from the outbox to the channels: queues, order, retries, one program at a time."""
