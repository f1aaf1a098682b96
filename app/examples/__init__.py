"""Scripts to copy from: each does one piece of work with the functions that the commands use, and is tested."""
