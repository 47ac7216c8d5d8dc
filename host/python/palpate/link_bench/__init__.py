"""`palpate bench links`: what every medium holds, how late it is, and what a message costs."""
