"""`igrow-trainer publish`: sign a bundle and put it into the exchange."""
