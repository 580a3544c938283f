"""Zhai, Yeary, Havlicek & Fan (2009): state-partition centralised particle filter, by sound level and direction."""
