"""What is asked: each function takes a system and a request and gives back a labelled Dataset."""
