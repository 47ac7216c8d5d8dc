"""`palpate reproduce`: the experiments of Jacobs, Fu and Cavusoglu (2010), sections 5 and 6.1, run again and compared
with what the paper states. One module per figure; `runner` runs their scenes, `report` writes the page."""
