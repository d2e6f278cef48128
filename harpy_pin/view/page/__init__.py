"""The replay page: one HTML file, shown in a browser or taken as a picture."""
