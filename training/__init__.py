"""How our own network is made: rooms by chance, their pictures and labels, the network, its training and its report."""
