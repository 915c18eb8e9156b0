"""A body in the ring that goes on after a contact is lost: pivot on one contact, flight, impact."""
