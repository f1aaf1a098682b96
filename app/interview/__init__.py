"""An experiment by questions and answers."""
