"""`palpate reproduce`: the experiments of Jacobs, Fu and Cavusoglu (2010), sections 2, 5 and 6.1, done again and compared
with what the paper states. One module per figure or table; `runner` runs their scenes, `studies` reduces their bodies,
`report` writes the page."""
