"""A web page that shows a pattern pixel for pixel and says which one it shows."""
