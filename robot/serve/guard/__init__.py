"""Who may come in, and how much anyone may ask for."""
