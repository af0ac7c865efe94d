"""Training of the network stages in torch: many steps at a time, so that whole seasons can be run freely."""
