"""Association: slaves find a master, by announcements, requests and answers over the radio."""
