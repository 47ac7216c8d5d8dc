"""`palpate bench mutants`: the mutation test of the safety supervisor."""
