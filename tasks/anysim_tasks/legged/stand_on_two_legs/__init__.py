"""Stand on two legs for five seconds, against pushes."""
