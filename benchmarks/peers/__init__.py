"""Other libraries (peers), with physics of their own, and with events as each library offers them."""
