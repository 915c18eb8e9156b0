"""What a specialist would use instead: each peer with its own physics, and events as it offers them."""
