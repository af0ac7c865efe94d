"""Training of the growth and yield stages in torch: many steps at a time, so that seasons can be run freely."""
