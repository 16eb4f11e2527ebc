"""A scene as its author gives it -> what is seen of it: light, G-buffer, reference pictures."""
