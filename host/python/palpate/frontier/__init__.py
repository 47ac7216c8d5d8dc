"""`palpate bench frontier`: error of the rendered force against what it costs, for each way to build a local model."""
